!> The terms of a system (`pd_force_term`) in their order, and the account of their work.
module pd_force_terms
  use pd_base_archive, only: archive_type, joined, of_slots, same
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_order, only: ascending_order, owned_point, place_in
  use pd_base_reduce, only: inner, sum_listed
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, number_at
  use pd_force_forces, only: up_to_marks
  use pd_force_term, only: force_term_type, name_of, no_stiffness, no_tangent, term_view_type
  implicit none (type, external)
  private
  public :: term_list_type

  !> A term in a list, and the account of its work.
  type :: item_type
    class(force_term_type), allocatable :: term
    real(wp), allocatable :: last_u(:, :)      !! displacements and forces at the last instant
    real(wp), allocatable :: last_force(:, :)  !! that was accounted [m], [N/m3]
    integer(i8), allocatable :: numbers(:)     !! of a term that acts on few points: instead of
    integer(i4), allocatable :: slots(:)       !! these the points on which it acted then, by their
    real(wp), allocatable :: few(:, :)         !! numbers and slots, its forces there (slots, dim)
                                               !! [N/m3]
    real(wp), allocatable :: few_u(:, :)       !! and displacements (slots, dim) [m]
    real(wp) :: last_time = 0.0_wp             !! and the time [s]
    real(wp) :: last_energy = 0.0_wp           !! that it stored then [J]
    real(wp) :: lost = 0.0_wp                  !! of a term that is not conservative: it took [J]
  end type item_type

  !> Terms in their order. It is a term itself: the sum of those that are not external, the bonds
  !> included where a view asks for them.
  type, extends(force_term_type) :: term_list_type
    type(item_type), allocatable :: items(:)   !! not allocated: none
    integer :: bonds = 0                       !! 1 if the first term is that of the bonds
    integer :: inside = 0                      !! other terms that are not external
    integer :: outside = 0                     !! external ones
    real(wp), allocatable :: force(:, :)       !! room for forces and energies of terms that act
                                               !! on few points, 0 between calls
    real(wp), allocatable :: density(:)
  contains
    procedure :: add
    procedure :: number
    procedure :: add_force => add_force_of_list
    procedure :: add_external
    procedure :: add_energy => add_energy_of_list
    procedure :: energy
    procedure :: add_stiffness_bound => add_bound_of_list
    procedure :: add_damping_bound => add_damping_of_list
    procedure :: add_tangent => add_tangent_of_list
    procedure :: begin => begin_list
    procedure :: advance => advance_list
    procedure :: search => search_list
    procedure :: account
    procedure :: keep => keep_list
    procedure :: describe => describe_list
    procedure :: without_tangent
    procedure :: accounts_of
    procedure :: has
  end type term_list_type

contains

  !> Add a term, as the last one, or the bonds as the first. Of a list, its terms are added one by
  !> one.
  recursive subroutine add(self, term)
    class(term_list_type), intent(inout) :: self  !! the list, with the term on return
    class(force_term_type), intent(in) :: term   !! is copied
    type(item_type), allocatable :: items(:)
    integer :: i, n, place

    select type (term)
    class is (term_list_type)
      do i = 1, term%number()
        call self%add(term%items(i)%term)
      end do
      return
    class default  ! a single term
      continue
    end select
    n = self%number()
    place = n + 1
    if (term%sets) then
      if (self%bonds > 0) call internal_fault('two terms that set the force')
      place = 1
    end if
    allocate (items(n + 1))
    allocate (items(place)%term, source=term)
    do i = 1, n
      call move_alloc(self%items(i)%term, items(merge(i, i + 1, i < place))%term)
    end do
    call move_alloc(items, self%items)
    if (term%sets) then
      self%bonds = 1
    else if (term%external) then
      self%outside = self%outside + 1
    else
      self%inside = self%inside + 1
    end if
    self%conservative = self%conservative .and. (term%external .or. term%conservative)
  end subroutine add

  !> The first term that acts at an instant: without the bonds where they are not asked for.
  pure integer function first_of(self, view) result(first)
    class(term_list_type), intent(in) :: self
    type(term_view_type), intent(in) :: view

    first = 1
    if (.not. view%bonds%asked) first = 1 + self%bonds
  end function first_of

  !> How many terms there are.
  pure integer function number(self)
    class(term_list_type), intent(in) :: self  !! the list

    number = 0
    if (allocated(self%items)) number = size(self%items)
  end function number

  !> The force density of the terms that are not external, added to `force`; set, if the view asks
  !> for the bonds. Of a part of their evaluation that has no forces yet they are all there is.
  subroutine add_force_of_list(self, view, force)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    integer :: i

    do i = first_of(self, view), self%number()
      if (.not. self%items(i)%term%external) call self%items(i)%term%add_force(view, force)
      if (view%bonds%asked .and. view%bonds%part == up_to_marks) exit
    end do
  end subroutine add_force_of_list

  !> The force density of the external terms that are not summed apart, added to `force`.
  subroutine add_external(self, view, force)
    class(term_list_type), intent(in) :: self           !! the list
    type(term_view_type), intent(in) :: view            !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) [N/m3]
    integer :: i

    do i = 1, self%number()
      if (self%items(i)%term%external .and. .not. self%items(i)%term%summed_apart) &
        & call self%items(i)%term%add_force(view, force)
    end do
  end subroutine add_external

  !> The energy density that the terms store which are not external, added to `density`; set, if the
  !> view asks for the bonds.
  subroutine add_energy_of_list(self, view, density)
    class(term_list_type), intent(in) :: self          !! the list
    type(term_view_type), intent(in) :: view           !! the instant
    real(wp), intent(inout), contiguous :: density(:)  !! (n_slots) energy density, added to [J/m3]
    integer :: i

    do i = first_of(self, view), self%number()
      if (.not. self%items(i)%term%external) call self%items(i)%term%add_energy(view, density)
    end do
  end subroutine add_energy_of_list

  !> The energy that the terms store which are not external [J]. That of the bonds is summed on its
  !> own: what others store beside it keeps its last digits.
  real(wp) function energy(self, view)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), allocatable :: density(:)
    type(term_view_type) :: others

    energy = 0.0_wp
    allocate (density(view%body%n_slots))
    if (view%bonds%asked .and. self%bonds > 0) then
      call self%items(1)%term%add_energy(view, density)
      energy = inner(view%body%order, density, view%body%volume)
    end if
    if (self%inside == 0) return
    others = view
    others%bonds%asked = .false.
    density = 0.0_wp
    call self%add_energy(others, density)
    energy = energy + inner(view%body%order, density, view%body%volume)
  end function energy

  !> Bounds of all terms, external ones included: they act on the motion as well. Set, if the view
  !> asks for the bonds.
  subroutine add_bound_of_list(self, view, bound)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, added to [N/m4]
    integer :: i

    do i = first_of(self, view), self%number()
      call self%items(i)%term%add_stiffness_bound(view, bound)
    end do
  end subroutine add_bound_of_list

  !> As above, of the damping.
  subroutine add_damping_of_list(self, view, bound)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]
    integer :: i

    do i = 1, self%number()
      call self%items(i)%term%add_damping_bound(view, bound)
    end do
  end subroutine add_damping_of_list

  !> What all terms resist, external ones included. Set, if the view asks for the bonds.
  subroutine add_tangent_of_list(self, view, w, kw)
    class(term_list_type), intent(in) :: self    !! the list
    type(term_view_type), intent(in) :: view     !! the instant
    real(wp), intent(in), contiguous :: w(:, :)  !! (n_slots, dim) small displacement [m]
    real(wp), intent(inout), contiguous :: kw(:, :)
      !! (n_slots, dim) resistance to it, added to [N/m3]
    integer :: i

    do i = first_of(self, view), self%number()
      if (self%items(i)%term%tangent /= no_stiffness) &
        & call self%items(i)%term%add_tangent(view, w, kw)
    end do
  end subroutine add_tangent_of_list

  !> All terms begin.
  subroutine begin_list(self, view)
    class(term_list_type), intent(inout) :: self  !! the list, with its terms begun on return
    type(term_view_type), intent(in) :: view      !! the start
    integer :: i

    do i = 1, self%number()
      call self%items(i)%term%begin(view)
    end do
  end subroutine begin_list

  !> All terms advance to the instant of the view.
  subroutine advance_list(self, view)
    class(term_list_type), intent(inout) :: self
      !! the list, with the histories of its terms up to date on return
    type(term_view_type), intent(in) :: view  !! the instant
    integer :: i

    do i = 1, self%number()
      call self%items(i)%term%advance(view)
    end do
  end subroutine advance_list

  !> All terms search, one after the other.
  subroutine search_list(self, view, before)
    class(term_list_type), intent(inout) :: self   !! the list
    type(term_view_type), intent(in) :: view       !! the instant
    class(force_term_type), intent(in), optional :: before  !! as of any term
    integer :: i

    do i = 1, self%number()
      if (i > 1) then
        call self%items(i)%term%search(view, self%items(i - 1)%term)
      else
        call self%items(i)%term%search(view, before)
      end if
    end do
  end subroutine search_list

  !> Work since the last call, by the trapezoidal rule: that of external terms adds to `supplied`,
  !> what terms that are not conservative took and do not store to `lost`. To be called once per
  !> step, when the forces are known.
  subroutine account(self, view, supplied, lost)
    class(term_list_type), intent(inout) :: self
      !! the list; keeps displacements, forces and energies of this instant
    type(term_view_type), intent(in) :: view        !! the instant
    real(wp), intent(inout) :: supplied             !! [J]
    real(wp), intent(inout) :: lost                 !! [J]
    real(wp), allocatable :: force(:, :), density(:)
    real(wp) :: work, stored
    integer :: i

    do i = 1, self%number()
      associate (item => self%items(i))
        if (item%term%summed_apart) cycle
        if (.not. item%term%external .and. item%term%conservative) cycle
        if (item%term%acts_on_few) then
          call account_few(self, i, view, lost)
          cycle
        end if
        if (.not. allocated(force)) allocate (force, mold=view%u)
        if (.not. allocated(density)) allocate (density(size(view%u, 1)))
        force = 0.0_wp
        call item%term%add_force(view, force)
        stored = 0.0_wp
        if (.not. item%term%external) then
          density = 0.0_wp
          call item%term%add_energy(view, density)
          stored = inner(view%body%order, density, view%body%volume)
        end if
        if (allocated(item%last_u)) then
          density = sum((item%last_force + force)/2*(view%u - item%last_u), 2)
          work = inner(view%body%order, density, view%body%volume)
          if (item%term%external) then
            supplied = supplied + work
          else
            lost = lost - work - (stored - item%last_energy)
            item%lost = item%lost - work - (stored - item%last_energy)
          end if
        end if
        item%last_u = view%u
        item%last_force = force
        item%last_energy = stored
      end associate
    end do
  end subroutine account

  !> The account of a term that acts on few points: nothing else is visited.
  subroutine account_few(self, i, view, lost)
    class(term_list_type), intent(inout) :: self
    integer, intent(in) :: i                !! which term
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout) :: lost
    integer(i4), allocatable :: slots(:)
    real(wp), allocatable :: few(:, :), few_u(:, :)
    real(wp) :: work, stored

    if (.not. allocated(self%force)) then
      allocate (self%force(size(view%u, 1), size(view%u, 2)), source=0.0_wp)
      allocate (self%density(size(view%u, 1)), source=0.0_wp)
    end if
    associate (item => self%items(i), body => view%body)
      call item%term%acting(view, slots)
      call item%term%add_force(view, self%force)
      few = self%force(slots, :)
      self%force(slots, :) = 0.0_wp
      call item%term%add_energy(view, self%density)
      stored = sum_listed(body%order, body%point(slots), self%density(slots)*body%volume(slots))
      self%density(slots) = 0.0_wp
      few_u = view%u(slots, :)
      if (allocated(item%few)) then
        if (.not. allocated(item%slots)) call find_slots(item, body)
        work = half_work(item%slots, item%few, view%u(item%slots, :) - item%few_u) &
          & + half_work(slots, few, few_u - places_before(item, view, slots))
        lost = lost - work - (stored - item%last_energy)
        item%lost = item%lost - work - (stored - item%last_energy)
      end if
      item%numbers = number_at(body, int(slots))
      call move_alloc(slots, item%slots)
      call move_alloc(few, item%few)
      call move_alloc(few_u, item%few_u)
      item%last_time = view%time
      item%last_energy = stored
    end associate

  contains

    !> Half of what forces on some points do [J].
    real(wp) function half_work(slots, few, way) result(work)
      integer(i4), intent(in) :: slots(:)
      real(wp), intent(in) :: few(:, :)
      real(wp), intent(in) :: way(:, :)    !! (slots, dim) by how much they have moved [m]
      real(wp), allocatable :: moved(:, :)

      moved = way
      if (self%items(i)%term%has_partner) &
        & call self%items(i)%term%subtract_partner(view, slots, moved)
      work = sum_listed(view%body%order, view%body%point(slots), &
        & sum(few/2*moved, 2)*view%body%volume(slots))
    end function half_work
  end subroutine account_few

  !> Displacements of some points at the last instant: of those on which the term did not act then
  !> by their velocities, which leaps between instants have exactly.
  function places_before(item, view, slots) result(u)
    type(item_type), intent(in) :: item
    type(term_view_type), intent(in) :: view
    integer(i4), intent(in) :: slots(:)              !! in the order of points
    real(wp), allocatable :: u(:, :)                 !! (slots, dim) [m]
    integer(i8), allocatable :: points(:)
    integer :: i, n

    if (size(slots) == size(item%slots)) then
      if (all(slots == item%slots)) then
        u = item%few_u
        return
      end if
    end if
    points = int(view%body%point(item%slots), i8)
    allocate (u(size(slots), size(view%u, 2)))
    do i = 1, size(slots)
      n = place_in(points, int(view%body%point(slots(i)), i8))
      if (n > 0) then
        u(i, :) = item%few_u(n, :)
      else
        u(i, :) = view%u(slots(i), :) - (view%time - item%last_time)*view%v(slots(i), :)
      end if
    end do
  end function places_before

  !> Keep all terms and the accounts of their work.
  subroutine keep_list(self, archive)
    class(term_list_type), intent(inout) :: self
      !! the list; histories and accounts are set where the archive reads
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    integer :: i

    do i = 1, self%number()
      associate (item => self%items(i))
        call item%term%keep(archive)
        if (item%term%summed_apart) cycle
        if (item%term%acts_on_few) then
          call keep_few(archive, item, 'of term '//to_text(i))
        else
          call archive%over(of_slots)
          call archive%keep('last place of term '//to_text(i), item%last_u)
          call archive%keep('last force of term '//to_text(i), item%last_force)
          call archive%over(same)
        end if
        call archive%keep('last energy of term '//to_text(i), item%last_energy)
        call archive%keep('loss of term '//to_text(i), item%lost)
      end associate
    end do
  end subroutine keep_list

  !> Keep where a term that acts on few points acted: of each point its number, then the forces and
  !> displacements of each component.
  subroutine keep_few(archive, item, name)
    class(archive_type), intent(inout) :: archive
    type(item_type), intent(inout) :: item
    character(*), intent(in) :: name
    integer(i8), allocatable :: numbers(:, :)
    real(wp), allocatable :: values(:, :)
    logical :: accounted
    integer :: points, dim

    accounted = allocated(item%few)
    call archive%keep('account '//name, accounted)
    ! there may have been fewer or more of them
    if (archive%reading .and. allocated(item%few)) deallocate (item%numbers, item%few, item%few_u)
    if (archive%reading .and. allocated(item%slots)) deallocate (item%slots)
    if (.not. accounted) return
    if (.not. archive%reading) then
      points = size(item%numbers)
      dim = size(item%few, 2)
      numbers = reshape(item%numbers, [points, 1])
      values = reshape(transpose(reshape([item%few, item%few_u], [points, 2*dim])), &
        & [2*dim*points, 1])
    end if
    call archive%over(joined)
    call archive%keep('points '//name, numbers)
    call archive%keep('forces and places '//name, values)
    call archive%over(same)
    call archive%keep('time '//name, item%last_time)
    if (allocated(archive%error) .or. .not. archive%reading) return
    points = size(numbers)
    dim = size(values)/(2*max(1, points))
    item%numbers = numbers(:, 1)
    values = transpose(reshape(values, [2*dim, points]))
    item%few = values(:, :dim)
    item%few_u = values(:, dim + 1:)
  end subroutine keep_few

  !> Find the points on which a term acted before a restart. Files of several ranks have them one
  !> file behind the other, and those of other ranks, too.
  subroutine find_slots(item, body)
    type(item_type), intent(inout) :: item  !! as it was kept; its slots are found
    type(body_type), intent(in) :: body
    integer, allocatable :: order(:)
    integer(i4), allocatable :: points(:)
    integer :: i

    order = ascending_order(item%numbers)
    points = [(int(owned_point(body%order, item%numbers(order(i))), i4), i=1, size(order))]
    order = pack(order, points > 0_i4)
    points = pack(points, points > 0_i4)
    item%slots = int(body%slot(points), i4)
    item%numbers = item%numbers(order)
    if (size(order) > 0) then
      item%few = item%few(order, :)
      item%few_u = item%few_u(order, :)
    else
      item%few = reshape([real(wp) ::], [0, body%dim])
      item%few_u = item%few
    end if
  end subroutine find_slots

  !> The lines of all terms, each ended by a newline.
  function describe_list(self) result(text)
    class(term_list_type), intent(in) :: self  !! the list
    character(:), allocatable :: text, one
    integer :: i

    text = ''
    do i = 1, self%number()
      one = self%items(i)%term%describe()
      if (one /= '') text = text//one//new_line('a')
    end do
  end function describe_list

  !> What the terms of a name store and, if they are not conservative, have taken, at the instant
  !> that was last accounted.
  subroutine accounts_of(self, view, name, stored, lost)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! that instant
    character(*), intent(in) :: name           !! of the terms
    real(wp), intent(out) :: stored            !! [J]
    real(wp), intent(out) :: lost              !! since the start [J]
    real(wp), allocatable :: density(:)
    integer :: i

    stored = 0.0_wp
    lost = 0.0_wp
    do i = 1, self%number()
      associate (item => self%items(i))
        if (.not. allocated(item%term%name)) cycle
        if (item%term%name /= name) cycle
        if (item%term%conservative) then
          allocate (density(view%body%n_slots), source=0.0_wp)
          call item%term%add_energy(view, density)
          stored = stored + inner(view%body%order, density, view%body%volume)
          deallocate (density)
        else
          stored = stored + item%last_energy
          lost = lost + item%lost
        end if
      end associate
    end do
  end subroutine accounts_of

  !> Whether there is a term of this name.
  pure logical function has(self, name)
    class(term_list_type), intent(in) :: self  !! the list
    character(*), intent(in) :: name           !! of a term
    integer :: i

    has = .false.
    do i = 1, self%number()
      if (.not. allocated(self%items(i)%term%name)) cycle
      has = has .or. self%items(i)%term%name == name
    end do
  end function has

  !> The name of the first term whose force depends on displacements and that has no tangent; '' if
  !> there is none.
  function without_tangent(self) result(name)
    class(term_list_type), intent(in) :: self  !! the list
    character(:), allocatable :: name
    integer :: i

    name = ''
    do i = 1, self%number()
      if (self%items(i)%term%tangent /= no_tangent) cycle
      name = name_of(self%items(i)%term)
      return
    end do
  end function without_tangent

end module pd_force_terms
