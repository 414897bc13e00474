!> What points and families of a scene show to be allowed, but to give wrong answers: bodies one
!> point thick, horizons too short for shear, volumes of a cloud that contradict the distances of
!> its points, cracks that run through points.
module pd_family_warnings
  use pd_base_eigen, only: eigenvectors
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_text, only: counted, to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_content_types, only: has_cut_cells, is_turned, scene_type, words_of_body
  use pd_body_body, only: body_type
  use pd_body_lattices, only: axes_of
  use pd_family_cracks, only: points_on
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_family_joints, only: joint_type, count_joints
  use pd_family_volume, only: horizon_of_bond, reach, rule_of_bond, volume_rule_type
  implicit none (type, external)
  private
  public :: warn_of_points, warn_of_crack

  real(wp), parameter :: flat = 1.0e-6_wp       !! height of a body one point thick [spacings]
  !> No arrangement has all points farther from their nearest ones than 1.12 times the root of their
  !> volume (the closest packing of spheres; 1.07 in 2D, 1 in 1D).
  real(wp), parameter :: most_distance = 1.25_wp
  !> Of the horizon's volume, that the volumes in it may sum up to: coarse families reach 1.67.
  real(wp), parameter :: most_filled = 2.0_wp
  !> Of the space, that the volumes around inner points may sum up to with weights that fall to 0 at
  !> the horizon: cubic, bcc, fcc and hexagonal arrays reach 1.17 at all horizons of 1 spacing and
  !> more, points thrown at random 1.04 at 3 spacings.
  real(wp), parameter :: most_mean = 1.5_wp
  !> They are counted in no smaller space [volumes of a point]: in it a point itself is much of it.
  real(wp), parameter :: least_space = 2.5_wp
  real(wp), parameter :: inner = 0.1_wp  !! the centre of an inner point's neighbours [horizons]
  real(wp), parameter :: too_far = 0.5_wp, too_full = 0.1_wp  !! parts of the points [-]

contains

  !> Add the warnings about points, families and cracks of a scene.
  subroutine warn_of_points(scene, body, family, warnings)
    type(scene_type), intent(in) :: scene            !! whose bodies and cracks are checked
    type(body_type), intent(in) :: body  !! its points, arranged in the slots of the family
    class(family_type), intent(in) :: family         !! cracks may be cut
    type(warnings_type), intent(inout) :: warnings   !! added to
    integer :: i

    do i = 1, size(scene%bodies)
      call warn_of_thickness(scene, body, family, i, warnings)
      call warn_of_horizon(body, family, i, words_of_body(scene%bodies, i), warnings)
      ! the volumes of a mesh are those of its elements, however long these are; cut cells
      ! are smaller than the space that they have
      if (scene%bodies(i)%mesh == '' .and. .not. has_cut_cells(scene%bodies(i))) &
        & call warn_of_volumes(body, family, i, words_of_body(scene%bodies, i), warnings)
    end do
    do i = 1, size(scene%cracks)
      ! facets are at hand only where they cut bonds
      if (scene%cracks(i)%surface == '') call warn_of_crack(i, points_on(scene%cracks(i), body), &
        & body, warnings)
    end do
    call warn_of_joints(scene, body, family, warnings)
  end subroutine warn_of_points

  !> Warn if a body of a 2D or 3D scene has one layer of points only and no neighbour across it: no
  !> bond resists its contraction, and it deforms as if that were prevented. A lattice is seen along
  !> its own axes; the points of clouds and meshes may lie on any surface.
  subroutine warn_of_thickness(scene, body, family, number, warnings)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    integer, intent(in) :: number        !! of the body
    type(warnings_type), intent(inout) :: warnings
    type(bonds_type) :: bonds
    logical, allocatable :: mine(:)
    logical :: thin
    real(wp) :: height, axes(3, 3)
    real(wp), allocatable :: places(:)
    integer :: c, k

    if (body%dim == 1) return
    mine = body%body == number .and. body%point > 0 .and. body%layer == 0
    if (count(mine) == 0) return
    call allocate_bonds(family, bonds)
    axes = axes_of(scene%bodies(number), body%dim)
    height = flat*minval(body%spacing, mask=mine)
    do c = 1, body%dim
      places = matmul(body%x, axes(:body%dim, c))
      if (maxval(places, mask=mine) - minval(places, mask=mine) > height) cycle
      thin = .false.  ! isolated points have another warning
      do k = 1, body%n_slots
        if (.not. mine(k)) cycle
        call family%bonds_of(k, bonds)
        if (bonds%n == 0) cycle
        thin = .not. any(abs(matmul(bonds%xi(:bonds%n, :), axes(:body%dim, c))) > height)
        if (.not. thin) exit
      end do
      if (.not. thin) cycle
      if (is_turned(scene%bodies(number))) then
        call warn(' along its axis '//to_text(c))
      else
        call warn(' in '//achar(iachar('x') + c - 1))
      end if
    end do
    if (warnings%has('thin body '//to_text(number)//' '//to_text(1)) .or. &
      & warnings%has('thin body '//to_text(number)//' '//to_text(2)) .or. &
      & warnings%has('thin body '//to_text(number)//' '//to_text(3))) return
    c = 0
    if (all(body%grid == 0 .or. .not. mine)) then
      if (is_surface(body, family, mine)) call warn('')
    end if

  contains

    !> The warning, with the direction in words.
    subroutine warn(direction)
      character(*), intent(in) :: direction
      call warnings%add('thin body '//to_text(number)//' '//to_text(c), &
        & words_of_body(scene%bodies, number)// &
        & ' is one point thick'//direction//': it cannot contract across, '// &
        & 'and is too stiff in tension by a factor of 1/(1 - nu^2) or more; use more points '// &
        & 'across it, or a scene of fewer dimensions', tell=.false.)
    end subroutine warn
  end subroutine warn_of_thickness

  !> Whether nearly all points have their neighbours in one plane, or on one line, even if that
  !> bends from point to point: the least eigenvalue of the mean of xi xi is small beside the square
  !> of the spacing. Two layers of points have a half of that.
  logical function is_surface(body, family, mine)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    logical, intent(in) :: mine(:)             !! (n_slots) points to look at
    integer, parameter :: most = 2000          ! points that stand for all
    real(wp), parameter :: small = 0.2_wp      ! root of that eigenvalue [spacings]
    real(wp), parameter :: nearly_all = 0.95_wp
    type(bonds_type) :: bonds
    real(wp) :: moments(body%dim, body%dim), values(body%dim), vectors(body%dim, body%dim)
    integer, allocatable :: slots(:)
    integer :: i, a, b, seen, in_plane

    call allocate_bonds(family, bonds)
    slots = pack(body%slot, mine(body%slot))
    seen = 0
    in_plane = 0
    do i = 1, size(slots), max(1, size(slots)/most)
      call family%bonds_of(slots(i), bonds)
      ! fewer neighbours span no space wherever they lie
      if (bonds%n <= body%dim) cycle
      do b = 1, body%dim
        do a = 1, body%dim
          moments(a, b) = dot_product(bonds%xi(:bonds%n, a), bonds%xi(:bonds%n, b))/bonds%n
        end do
      end do
      call eigenvectors(moments, values, vectors)
      seen = seen + 1
      if (minval(values) < (small*body%spacing(slots(i)))**2) in_plane = in_plane + 1
    end do
    is_surface = seen > 0 .and. in_plane >= nearly_all*seen
  end function is_surface

  !> Warn if no bond of a body runs along a diagonal of its grid.
  subroutine warn_of_horizon(body, family, number, name, warnings)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    integer, intent(in) :: number        !! of the body
    character(*), intent(in) :: name     !! of the body, as in messages
    type(warnings_type), intent(inout) :: warnings
    type(volume_rule_type) :: rule
    real(wp) :: spacing

    if (body%dim == 1) return
    if (.not. any(body%body == number .and. body%point > 0)) return
    spacing = maxval(body%spacing, mask=body%body == number .and. body%point > 0)
    rule = rule_of_bond(family%rule, spacing, spacing)
    if (reach(rule, spacing, body%dim) >= sqrt(2.0_wp)*spacing) return
    call warnings%add('short horizon '//to_text(number), 'the horizon of '// &
      & with_unit(rule%delta, 'm', 4)//' is shorter than 1.4142 spacings of '// &
      & with_unit(spacing, 'm', 4)//': '//name//' has no diagonal bonds and no shear '// &
      & 'stiffness; use a &horizon ratio of 2 to 4', tell=.false.)
  end subroutine warn_of_horizon

  !> Warn if the volumes of a cloud are much smaller or larger than the space its points have.
  subroutine warn_of_volumes(body, family, number, name, warnings)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    integer, intent(in) :: number        !! of the body
    character(*), intent(in) :: name     !! of the body, as in messages
    type(warnings_type), intent(inout) :: warnings
    real(wp), parameter :: ball(3) = [2.0_wp, pi, 4*pi/3]  ! volume of the unit ball
    real(wp), parameter :: cone(3) = [1.0_wp, pi/3, pi/3]  ! integral of 1 - r over it
    type(bonds_type) :: bonds
    real(wp) :: filled, reached, space, weighted, ratios, centre(3), weight
    integer :: points, far, full, inside, k, i

    points = 0
    far = 0
    full = 0
    inside = 0
    ratios = 0.0_wp
    !$omp parallel default(none) shared(body, family, number) private(bonds, filled, reached, k, &
    !$omp i, space, weighted, weight, centre) reduction(+:points, far, full, inside, ratios)
    call allocate_bonds(family, bonds)
    !$omp do schedule(static)
    do k = 1, body%n_slots
      if (body%point(k) == 0 .or. body%body(k) /= number .or. body%grid(k) /= 0) cycle
      call family%bonds_of(k, bonds)
      points = points + 1
      if (.not. any(bonds%length(:bonds%n) <= most_distance*body%spacing(k))) far = far + 1
      filled = body%spacing(k)**body%dim + sum(body%spacing(bonds%j(:bonds%n))**body%dim)
      reached = horizon_of_bond(family%rule, body%spacing(k), max(body%spacing(k), &
        & maxval(body%spacing(bonds%j(:bonds%n)))))
      if (filled > most_filled*ball(body%dim)*reached**body%dim) full = full + 1
      space = cone(body%dim)*reached**body%dim
      weighted = body%spacing(k)**body%dim
      if (space < least_space*weighted) cycle
      centre = 0.0_wp
      do i = 1, bonds%n
        weight = body%spacing(bonds%j(i))**body%dim*max(0.0_wp, 1 - bonds%length(i)/reached)
        weighted = weighted + weight
        centre(:body%dim) = centre(:body%dim) + weight*bonds%xi(i, :)
      end do
      if (bonds%n == 0 .or. norm2(centre) > inner*reached*weighted) cycle
      inside = inside + 1
      ratios = ratios + weighted/space
    end do
    !$omp end parallel
    if (points == 0) return
    if (far > too_far*points) then
      call warnings%add('cloud volumes '//to_text(number), name//': the volumes are too small '// &
        & 'for the distances of its points; '//to_text(far)//' of '//to_text(points)// &
        & ' points have their nearest one farther away than '//to_text(most_distance)// &
        & ' times volume^(1/dimension)', tell=.false.)
    else if (full > too_full*points) then
      call warnings%add('cloud volumes '//to_text(number), name//': the volumes are too large '// &
        & 'for the distances of its points; around '//to_text(full)//' of '//to_text(points)// &
        & ' points they sum up to more than twice the volume within the horizon', tell=.false.)
    else if (ratios > most_mean*inside) then
      call warnings%add('cloud volumes '//to_text(number), name//': the volumes are too large '// &
        & 'for the distances of its points; around points inside of it they sum up to '// &
        & to_text(ratios/inside, 2)//' times the space in the mean', tell=.false.)
    end if
  end subroutine warn_of_volumes

  !> Warn if a crack runs through points: they count as lying on one side of it.
  subroutine warn_of_crack(number, points, body, warnings)
    integer, intent(in) :: number        !! of the crack
    integer, intent(in) :: points        !! that lie on it
    type(body_type), intent(in) :: body  !! its points
    type(warnings_type), intent(inout) :: warnings   !! added to

    if (points == 0) return
    call warnings%add('crack through points '//to_text(number), '&crack number '// &
      & to_text(number)//' runs through '//counted(points, 'point')//'; points on a crack '// &
      & 'count as lying on one side of it, so that the cut is not symmetric: shift it by half '// &
      & 'a spacing ('//with_unit(minval(body%spacing, mask=body%point > 0)/2, 'm', 4)// &
      & ') across its plane', tell=.false.)
  end subroutine warn_of_crack

  !> Warn of bodies that are bonded because points of both lie within one horizon: the first few
  !> pairs one by one.
  subroutine warn_of_joints(scene, body, family, warnings)
    type(scene_type), intent(in) :: scene            !! for the names of bodies
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(warnings_type), intent(inout) :: warnings   !! added to
    integer, parameter :: most = 10  ! pairs reported one by one
    type(joint_type), allocatable :: joints(:)
    integer :: i

    call count_joints(body, family, joints)
    do i = 1, min(most, size(joints))
      call warnings%add('joint '//to_text(i), to_text(joints(i)%bonds)//' bonds join '// &
        & words_of_body(scene%bodies, joints(i)%bodies(1))//' and '// &
        & words_of_body(scene%bodies, joints(i)%bodies(2))// &
        & ', whose points lie within a horizon of each other: they act as one; a &crack '// &
        & 'between them parts them', tell=.false.)
    end do
    if (size(joints) > most) call warnings%add('joints', to_text(sum(joints(most + 1:)%bonds))// &
      & ' bonds join '//to_text(size(joints) - most)//' more pairs of bodies', tell=.false.)
  end subroutine warn_of_joints

end module pd_family_warnings
