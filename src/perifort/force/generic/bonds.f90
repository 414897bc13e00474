!> What the laws of the generic pass see: the bonds of each point with their stretches, surface
!> factors and histories, in a workspace that is made once.
!>
!> Values of bonds are in the order of the slots and of `bonds_of`. History belongs to the ordered
!> bond, (k, j), and is owned by k.
module pd_force_generic_bonds
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i2, i4, i8
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_surface, only: bond_factor
  use pd_force_model, only: force_options_type, has_scales, model_type
  use pd_force_workspace, only: generic_workspace_type
  use pd_law_law, only: allocate_law_bonds, law_bonds_type
  implicit none (type, external)
  private
  public :: begin_laws, new_law_bonds, refresh_bonds, refresh_slot, gather_bonds, check_room

contains

  !> What the laws take from the whole family, before cracks are cut: scales of the points on the
  !> fast loops, or constants of the points and room for the pulls and histories of the generic
  !> pass.
  subroutine begin_laws(body, family, model, workspace)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole
    type(model_type), intent(inout) :: model  !! with its laws; gets the scales of its slots
    type(generic_workspace_type), intent(inout) :: workspace  !! made if the model is generic
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    integer(i8) :: n
    integer :: k

    if (.not. (model%generic .or. has_scales(model))) return
    if (model%generic) then
      allocate (workspace%start(family%n_slots + 1))
      workspace%x = body%x
      call allocate_bonds(family, bonds)
      n = 1_i8
      do k = 1, family%n_slots
        workspace%start(k) = n
        call family%bonds_of(k, bonds)
        n = n + bonds%n
      end do
      workspace%start(family%n_slots + 1) = n
      allocate (workspace%member(n - 1), workspace%volume(n - 1))
      call find_other_ends(family, workspace)
      call refresh_bonds(family, workspace)
      allocate (workspace%pull(n - 1), source=0.0_wp)
      allocate (workspace%history(most(model, 'bond'), n - 1), source=0.0_wp)
      allocate (workspace%of_point(most(model, 'point'), family%n_slots), source=0.0_wp)
      allocate (workspace%constants(most(model, 'constants'), family%n_slots), source=0.0_wp)
    else
      allocate (model%scale(family%n_slots), source=1.0_wp)
    end if
    !$omp parallel default(none) shared(body, family, model, workspace) private(bonds, seen, k)
    call allocate_bonds(family, bonds)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      seen%n = bonds%n
      seen%length(:bonds%n) = bonds%length(:bonds%n)
      seen%volume(:bonds%n) = bonds%weight(:bonds%n)
      associate (law => model%laws(model%material(k))%law)
        call law%begin(seen)
        if (model%generic) then
          workspace%constants(:, k) = seen%constants
        else if (law%point_constants > 0) then
          model%scale(k) = seen%constants(1)
        end if
      end associate
    end do
    !$omp end parallel
  end subroutine begin_laws

  !> The most reals that a law in use has of a kind.
  pure integer function most(model, kind)
    type(model_type), intent(in) :: model
    character(*), intent(in) :: kind
    integer :: i

    most = 0
    do i = 1, size(model%laws)
      associate (law => model%laws(i)%law)
        select case (kind)
        case ('bond'); most = max(most, law%bond_history)
        case ('point'); most = max(most, law%point_history)
        case ('constants'); most = max(most, law%point_constants)
        case default
          call internal_fault('an unknown kind of history')
        end select
      end associate
    end do
  end function most

  !> Room for what the laws of a model see of a point.
  pure subroutine new_law_bonds(family, model, seen)
    class(family_type), intent(in) :: family   !! whose largest number of bonds counts
    type(model_type), intent(in) :: model      !! with its laws
    type(law_bonds_type), intent(out) :: seen  !! without a bond
    call allocate_law_bonds(family%most_bonds, most(model, 'bond'), most(model, 'point'), &
      & most(model, 'constants'), seen)
  end subroutine new_law_bonds

  !> Where each bond stands in the family of its other end. The bonds of j in the order of
  !> their other ends belong, one by one, to the slots that have a bond to j, in their order.
  subroutine find_other_ends(family, workspace)
    class(family_type), intent(in) :: family
    type(generic_workspace_type), intent(inout) :: workspace
    type(bonds_type) :: bonds
    integer, allocatable :: order(:)
    integer(i4), allocatable :: met(:)
    integer(i2), allocatable :: sorted(:)
    integer :: k, i, j

    allocate (workspace%partner(workspace%start(family%n_slots + 1) - 1))
    allocate (sorted(size(workspace%partner, kind=i8)))
    !$omp parallel default(none) shared(family, workspace, sorted) private(bonds, order, k, i)
    call allocate_bonds(family, bonds)
    allocate (order(family%most_bonds))
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      call sort_by(bonds%j(:bonds%n), order(:bonds%n))
      do i = 1, bonds%n
        sorted(workspace%start(k) + i - 1) = int(order(i), i2)
      end do
    end do
    !$omp end parallel
    allocate (met(family%n_slots), source=0_i4)
    call allocate_bonds(family, bonds)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        j = bonds%j(i)
        workspace%member(workspace%start(k) + i - 1) = int(j, i4)
        workspace%partner(workspace%start(k) + i - 1) = workspace%start(j) &
          & + sorted(workspace%start(j) + met(j)) - 1
        met(j) = met(j) + 1_i4
      end do
    end do
    if (any(met /= workspace%start(2:) - workspace%start(:family%n_slots))) &
      & call internal_fault('a bond that its other end does not have')
  end subroutine find_other_ends

  !> The order of ascending values, by merging.
  pure subroutine sort_by(values, order)
    integer(i4), intent(in) :: values(:)
    integer, intent(out) :: order(:)
    integer :: merged(size(values))
    integer :: width, first, middle, last, a, b, m

    order = [(m, m=1, size(values))]
    width = 1
    do while (width < size(values))
      do first = 1, size(values), 2*width
        middle = min(first + width, size(values) + 1)
        last = min(first + 2*width, size(values) + 1)
        a = first
        b = middle
        do m = first, last - 1
          if (b >= last) then
            merged(m) = order(a)
            a = a + 1
          else if (a >= middle) then
            merged(m) = order(b)
            b = b + 1
          else if (values(order(a)) <= values(order(b))) then
            merged(m) = order(a)
            a = a + 1
          else
            merged(m) = order(b)
            b = b + 1
          end if
        end do
      end do
      order = merged
      width = 2*width
    end do
  end subroutine sort_by

  !> Note which bonds are intact.
  subroutine refresh_bonds(family, workspace)
    class(family_type), intent(in) :: family      !! as its bonds are now
    type(generic_workspace_type), intent(inout) :: workspace  !! begun; gets the volumes of bonds
    type(bonds_type) :: bonds
    integer :: k

    if (.not. allocated(workspace%start)) return
    !$omp parallel default(none) shared(family, workspace) private(bonds, k)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      call refresh_slot(k, bonds, workspace)
    end do
    !$omp end parallel
  end subroutine refresh_bonds

  !> Note which bonds of slot `k` are intact.
  pure subroutine refresh_slot(k, bonds, workspace)
    integer, intent(in) :: k                !! slot
    type(bonds_type), intent(in) :: bonds   !! its bonds as they are now
    type(generic_workspace_type), intent(inout) :: workspace  !! begun; gets the volumes of bonds

    workspace%volume(workspace%start(k):workspace%start(k + 1) - 1) = &
      & merge(bonds%weight(:bonds%n), 0.0_wp, bonds%intact(:bonds%n))
  end subroutine refresh_slot

  !> A workspace that was made for another family is an error of the program.
  subroutine check_room(family, workspace)
    class(family_type), intent(in) :: family
    type(generic_workspace_type), intent(in) :: workspace

    if (.not. allocated(workspace%start)) call internal_fault('laws that have not begun')
    if (size(workspace%start) /= family%n_slots + 1) &
      & call internal_fault('a workspace of another family')
  end subroutine check_room

  !> The bonds of slot `k` at displacements `u` as its law sees them, with the committed history.
  pure subroutine gather_bonds(model, options, workspace, u, k, seen)
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(generic_workspace_type), intent(in) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    integer, intent(in) :: k
    type(law_bonds_type), intent(inout) :: seen
    integer(i8) :: first, last
    integer :: n

    first = workspace%start(k)
    last = workspace%start(k + 1) - 1
    n = int(last - first) + 1
    seen%n = n
    seen%volume(:n) = workspace%volume(first:last)
    call deform(size(u, 1), size(u, 2), n, workspace%member(first:last), workspace%x, u, k, &
      & options%projected, seen%length, seen%stretch, seen%projection)
    if (.not. options%projected) seen%projection(:n) = 1.0_wp
    if (options%thermal) seen%stretch(:n) = seen%stretch(:n) - (model%expansion(k) &
      & + model%expansion(workspace%member(first:last)))/2
    if (model%surface) call correct(model, workspace, k, seen)
    if (size(seen%history, 1) > 0) seen%history(:, :n) = workspace%history(:, first:last)
    seen%of_point = workspace%of_point(:, k)
    seen%constants = workspace%constants(:, k)
  end subroutine gather_bonds

  !> Lengths, stretches without cancellation (doc/theory.md, 2) and, if `projected`, Lambda.
  pure subroutine deform(n_slots, dim, n, member, x, u, k, projected, length, stretch, projection)
    integer, intent(in) :: n_slots, dim, n, k
    integer(i4), intent(in) :: member(n)
    real(wp), intent(in) :: x(n_slots, dim), u(n_slots, dim)
    logical, intent(in) :: projected
    real(wp), intent(inout) :: length(n), stretch(n), projection(n)
    real(wp) :: along(n), xi, eta
    integer :: i, c

    length = 0.0_wp
    stretch = 0.0_wp
    along = 0.0_wp
    do c = 1, dim
      do i = 1, n
        xi = x(member(i), c) - x(k, c)
        eta = u(member(i), c) - u(k, c)
        length(i) = length(i) + xi**2
        along(i) = along(i) + xi*eta
        stretch(i) = stretch(i) + eta**2
      end do
    end do
    do i = 1, n
      stretch(i) = 2*along(i) + stretch(i)
    end do
    if (projected) then
      do i = 1, n
        projection(i) = (length(i) + along(i))/max(sqrt(max(length(i) + stretch(i), 0.0_wp) &
          & *length(i)), tiny(1.0_wp))
      end do
    end if
    do i = 1, n
      stretch(i) = stretch(i)/(length(i) + sqrt(max(length(i) + stretch(i), 0.0_wp)*length(i)))
      length(i) = sqrt(length(i))
    end do
  end subroutine deform

  !> Surface factors of the bonds of slot `k`.
  pure subroutine correct(model, workspace, k, seen)
    type(model_type), intent(in) :: model
    type(generic_workspace_type), intent(in) :: workspace
    integer, intent(in) :: k
    type(law_bonds_type), intent(inout) :: seen
    real(wp) :: direction(model%dim)
    integer :: i, j

    do i = 1, seen%n
      j = workspace%member(workspace%start(k) + i - 1)
      direction = (workspace%x(j, :) - workspace%x(k, :))/seen%length(i)
      seen%Gd(i) = bond_factor(direction, model%D(k, :), model%D(j, :), model%axes)
      seen%Gb(i) = bond_factor(direction, model%S(k, :), model%S(j, :), model%axes)
    end do
  end subroutine correct

end module pd_force_generic_bonds
