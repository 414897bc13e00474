!> Shapes of bodies, and shapes that cut them: volume, centre and second moments against closed
!> forms.
module test_body_shapes
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body
  use pd_scene_content_check, only: check_scene
  use pd_scene_content_types, only: scene_type
  use bodies, only: box_scene, expect_true
  use comparisons, only: expect_close
  use test_scene_expect, only: expect_fault, expect_scene, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_body_shapes

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: toward(3) = [1.0_wp, 2.0_wp, 2.0_wp]/3   !! not along any lattice row
  !> Cells at a surface are whole or left out: over so many spacings that is about so much.
  real(wp), parameter :: of_volume = 0.01_wp, of_length = 0.005_wp, of_moment = 0.015_wp
  character(*), parameter :: head = '&material youngs_modulus = 1 density = 1 poissons_ratio = '// &
    & '0.2 /'//line//'&time steps = 1 /'//line
  character(*), parameter :: plane = '&scene dimension = 2 /'//line//head, &
    & space = '&scene dimension = 3 /'//line//head
  character(*), parameter :: square = '&body lower = 0 0 upper = 1 1 points = 9 9 /'//line

contains

  subroutine collect_body_shapes(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('bodies that are boxes, spheres, cylinders and discs', test_bodies), &
      & new_unittest('cones, half-spaces and cylinders of any direction', test_cuts), &
      & new_unittest('wedges and strips of a plane', test_plane), &
      & new_unittest('what is kept, by shapes, regions and expressions', test_keep), &
      & new_unittest('a notch is one group', test_notch), &
      & new_unittest('shapes that are refused', test_refused)]
  end subroutine collect_body_shapes

  !> Volume [m3], centre [m] and second moments about it over the volume [m2] of a body, cells and
  !> not points.
  subroutine moments_of(body, volume, centre, second)
    type(body_type), intent(in) :: body
    real(wp), intent(out) :: volume, centre(3), second(3, 3)
    integer :: c, d

    volume = sum(body%volume)
    centre = 0.0_wp
    second = 0.0_wp
    do c = 1, body%dim
      centre(c) = sum(body%volume*body%x(:, c))/volume
    end do
    do c = 1, body%dim
      do d = 1, body%dim
        second(c, d) = sum(body%volume*(body%x(:, c) - centre(c))*(body%x(:, d) - centre(d)))/volume
      end do
      second(c, c) = second(c, c) + body%spacing(1)**2/12
    end do
  end subroutine moments_of

  !> The points of a scene against a shape whose second moments are `along` a direction and `across`
  !> it.
  subroutine compare(error, scene, volume, centre, direction, along, across, size, what)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: volume, centre(3), direction(3), along, across, size
    character(*), intent(in) :: what
    type(fault_type), allocatable :: fault
    type(body_type) :: body
    real(wp) :: delta, found_volume, found_centre(3), second(3, 3), expected(3, 3)
    integer :: c, d

    call generate_body(scene, body, delta, fault)
    if (allocated(fault)) then
      if (.not. allocated(error)) call test_failed(error, what//': '//fault%message)
      return
    end if
    call moments_of(body, found_volume, found_centre, second)
    call expect_close(error, found_volume/volume, 1.0_wp, of_volume, what//': volume')
    call expect_close(error, found_centre, centre, of_length*size, what//': centre')
    expected = 0.0_wp
    do c = 1, body%dim
      do d = 1, body%dim
        expected(c, d) = (along - across)*direction(c)*direction(d)
      end do
      expected(c, c) = expected(c, c) + across
    end do
    call expect_close(error, second, expected, of_moment*max(along, across), what//': moments')
  end subroutine compare

  subroutine test_bodies(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    character(*), parameter :: ball = "&body shape = 'sphere' centre = 1 2 3 radius = 0.5 "// &
      & 'spacing = 0.025 /'//line
    character(*), parameter :: rod = "&body shape = 'cylinder' centre = 1 2 3 axis = 'AXIS' "// &
      & 'radius = 0.5 height = 2 spacing = 0.025 /'//line
    character(*), parameter :: disc = "&body shape = 'sphere' centre = 1 2 radius = 0.5 "// &
      & 'spacing = 0.01 /'//line
    real(wp) :: axis(3)
    integer :: c, at

    call expect_scene(error, space//ball, scene)
    if (allocated(error)) return
    call compare(error, scene, 4*pi/3*0.5_wp**3, [1.0_wp, 2.0_wp, 3.0_wp], toward, 0.05_wp, &
      & 0.05_wp, 0.5_wp, 'sphere')
    at = index(rod, 'AXIS')
    do c = 1, 3
      call expect_scene(error, space//rod(:at - 1)//'xyz'(c:c)//rod(at + 4:), scene)
      if (allocated(error)) return
      axis = 0.0_wp
      axis(c) = 1.0_wp
      call compare(error, scene, pi*0.25_wp*2, [1.0_wp, 2.0_wp, 3.0_wp] + axis, axis, &
        & 2.0_wp**2/12, 0.25_wp/4, 1.0_wp, 'cylinder along '//'xyz'(c:c))
      call expect_close(error, scene%bodies(1)%upper(c) - scene%bodies(1)%lower(c), 2.0_wp, &
        & 1.0e-14_wp, 'length of a cylinder')
    end do
    call expect_scene(error, plane//disc, scene)
    if (allocated(error)) return
    call compare(error, scene, pi*0.25_wp*scene%header%thickness, [1.0_wp, 2.0_wp, 0.0_wp], axis, &
      & 0.25_wp/4, 0.25_wp/4, 0.5_wp, 'disc')
    ! a box of a spacing is the box of as many points
    call expect_scene(error, space//"&body shape = 'box' lower = 0 0 1 upper = 0.3 0.2 2 "// &
      & 'spacing = 0.1 /'//line, scene)
    if (allocated(error)) return
    call expect_true(error, all(scene%bodies(1)%points == [3, 2, 10]), 'points of a box')
    ! a scene that is complete is not changed
    call again(error, scene)
  end subroutine test_bodies

  !> Checking twice changes nothing.
  subroutine again(error, scene)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(inout) :: scene
    type(fault_type), allocatable :: fault
    integer :: before(3)

    before = scene%bodies(1)%points
    call check_scene(scene, fault)
    call expect_true(error, .not. allocated(fault), 'a complete scene is refused')
    call expect_true(error, all(scene%bodies(1)%points == before), 'a complete scene has changed')
  end subroutine again

  subroutine test_cuts(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), parameter :: tip(3) = [-0.5_wp, -0.9_wp, -0.9_wp], r = tan(pi/6)*1.2_wp
    character(:), allocatable :: group

    call box_scene([80, 80, 80], 0.025_wp, 0.25_wp, scene)
    scene%bodies(1)%lower = -1.0_wp
    scene%bodies(1)%upper = 1.0_wp
    deallocate (scene%kept)
    allocate (scene%kept(1))
    associate (cut => scene%kept(1))
      cut%shape = 'cone'
      cut%centre = tip
      cut%direction = 5*toward
      cut%height = 1.2_wp
      cut%angle = 60.0_wp
      call compare(error, scene, pi*r**2*1.2_wp/3, tip + 0.9_wp*toward, toward, &
        & 3*1.2_wp**2/80, 3*r**2/20, 1.2_wp, 'cone')
      cut%shape = 'cylinder'
      cut%radius = 0.3_wp
      cut%height = 1.5_wp
      cut%centre = tip + 0.1_wp
      call compare(error, scene, pi*0.09_wp*1.5_wp, tip + 0.1_wp + 0.75_wp*toward, toward, &
        & 1.5_wp**2/12, 0.09_wp/4, 1.5_wp, 'cylinder')
    end associate
    group = "&body shape = 'sphere' radius = 1 spacing = 0.05 /"//line
    call expect_scene(error, space//group//"&remove shape = 'half_space' direction = -1 -2 -2 /"// &
      & line, scene)
    if (allocated(error)) return
    call compare(error, scene, 2*pi/3, 0.375_wp*toward, toward, 0.2_wp - 0.375_wp**2, 0.2_wp, &
      & 1.0_wp, 'half of a sphere')
  end subroutine test_cuts

  subroutine test_plane(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), parameter :: tip(3) = [-0.7_wp, -0.8_wp, 0.0_wp], half = tan(pi/9)*1.3_wp
    real(wp) :: direction(3)

    direction = [0.6_wp, 0.8_wp, 0.0_wp]
    call box_scene([300, 300], 2.0_wp/300, 0.3_wp, scene)
    scene%bodies(1)%lower(:2) = -1.0_wp
    scene%bodies(1)%upper(:2) = 1.0_wp
    deallocate (scene%kept)
    allocate (scene%kept(1))
    associate (cut => scene%kept(1), h => scene%header%thickness)
      cut%shape = 'cone'
      cut%centre = tip
      cut%direction(:2) = direction(:2)
      cut%height = 1.3_wp
      cut%angle = 40.0_wp
      call compare(error, scene, half*1.3_wp*h, tip + 1.3_wp*2/3*direction, direction, &
        & 1.3_wp**2/18, half**2/6, 1.3_wp, 'wedge')
      cut%shape = 'cylinder'
      cut%radius = 0.2_wp
      call compare(error, scene, 0.4_wp*1.3_wp*h, tip + 0.65_wp*direction, direction, &
        & 1.3_wp**2/12, 0.4_wp**2/12, 1.3_wp, 'strip')
    end associate
  end subroutine test_plane

  !> Groups `&keep` together, then `&remove`; a region and an expression in place of a shape.
  subroutine test_keep(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: box = '&body lower = -2 -1 upper = 2 1 points = 80 40 /'//line
    character(*), parameter :: left = "&keep shape = 'sphere' centre = -1 0 radius = 0.8 /"//line, &
      & right = "&keep where = '(x - 1)^2 + y^2 <= 0.64' /"//line, &
      & ring = "&region name = 'inner' where = 'abs(abs(x) - 1)^2 + y^2 < 0.09' /"//line
    integer :: one, both, hollow, upper

    one = number(error, plane//box//left)
    both = number(error, plane//box//left//right)
    call expect_true(error, one > 400 .and. both == 2*one, 'two kept discs: '//to_text(one)// &
      & ' and '//to_text(both))
    hollow = number(error, plane//box//left//right//ring//"&remove region = 'inner' /"//line)
    call expect_true(error, hollow == both - 2*number(error, plane//box// &
      & "&keep shape = 'sphere' centre = 1 0 radius = 0.3 /"//line), 'a removed region: '// &
      & to_text(hollow))
    ! all that is given must hold
    upper = number(error, plane//box//left//"&remove region = 'inner' where = 'y > 0' "// &
      & "shape = 'half_space' centre = -1 0 direction = 1 0 /"//line//ring)
    call expect_true(error, one - upper == (both - hollow)/8, 'a quarter of the region: '// &
      & to_text(one - upper))
  end subroutine test_keep

  !> Number of points of a scene.
  integer function number(error, text)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    number = 0
    if (allocated(error)) return
    call expect_scene(error, text, scene)
    if (allocated(error)) return
    call generate_body(scene, body, delta, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    number = body%n_points
  end function number

  !> A V-notch of 60 degrees whose faces lie between points: of the rows from its tip on, those that
  !> are nearer to the middle than tan(30) times the way from the tip.
  subroutine test_notch(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 40
    integer :: i, j, left

    left = 0
    do j = 1, n
      do i = 1, n
        if (abs(i - 0.5_wp - n/2) <= tan(pi/6)*(j - 0.5_wp - (n - 12.3_wp))) cycle
        left = left + 1
      end do
    end do
    call expect_true(error, left == number(error, plane// &
      & '&body lower = 0 0 upper = 40 40 points = 40 40 /'//line// &
      & "&remove shape = 'cone' centre = 20 27.7 direction = 0 1 angle = 60 /"//line), &
      & 'points beside a V-notch')
  end subroutine test_notch

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, space//"&body shape = 'sphere' spacing = 0.1 /"//line, &
      & "a sphere without the key 'radius'|a/b.nml:4")
    call expect_fault(error, space//"&body shape = 'sphere' radius = 1 /"//line, &
      & "needs the key 'spacing'|a/b.nml:4")
    call expect_fault(error, space//"&body shape = 'sphere' radius = 1 spacing = 0.1 points = "// &
      & "2 2 "// &
      & '2 /'//line, "a body with a 'shape' has no key 'points'|a/b.nml:4")
    call expect_fault(error, space//"&body shape = 'sphere' radius = 1 spacing = 0.1 lower = 0 "// &
      & "0 "// &
      & '0 /'//line, "a sphere has no key 'lower'|a/b.nml:4")
    call expect_fault(error, space//"&body shape = 'cylinder' radius = 1 spacing = 0.1 /"//line, &
      & "a cylinder without the key 'height'|a/b.nml:4")
    call expect_fault(error, space//"&body shape = 'cylinder' radius = 1 height = 0.33 "// &
      & 'spacing = 0.1 /'//line, 'the spacing does not divide the length of 0.33 m along z|'// &
      & '0.11 m (3 points)|a/b.nml:4')
    call expect_fault(error, plane//"&body shape = 'cylinder' radius = 1 height = 1 spacing = "// &
      & "0.1 /" &
      & //line, "this cylinder in a scene of dimension 2|axis = 'z'|a/b.nml:4")
    call expect_fault(error, plane//'&body lower = 0 0 upper = 1 1 points = 9 9 radius = 1 '// &
      & '/'//line, &
      & "a body without a shape has no key 'radius'|a/b.nml:4")
    call expect_fault(error, plane//square//"&keep /"//line, "&keep lacks the key 'shape'|"// &
      & "'region' or 'where'|a/b.nml:5")
    call expect_fault(error, plane//square//'&remove radius = 1 /'//line, &
      & "&remove lacks the key "// &
      & "'shape'|a/b.nml:5")
    call expect_fault(error, plane//square//"&remove region = 'nowhere' /"//line, &
      & "no region is named 'nowhere'|a/b.nml:5")
    call expect_fault(error, plane//square//"&remove where = 'x + t' /"//line, 'a/b.nml:5')
    call expect_fault(error, plane//square//"&remove shape = 'cone' angle = 30 /"//line, &
      & "lacks the key 'direction'|a/b.nml:5")
    call expect_fault(error, plane//square//"&remove shape = 'cone' direction = 1 0 /"//line, &
      & "a cone without the key 'angle'|a/b.nml:5")
    call expect_fault(error, plane//square//"&remove shape = 'half_space' direction = 0 0 "// &
      & "/"//line, &
      & "'direction' is zero|a/b.nml:5")
    call expect_fault(error, plane//square//"&remove shape = 'half_space' direction = 1 0 "// &
      & 'radius = 1 /'//line, "'radius' is no key of a half_space|a/b.nml:5")
    call expect_fault(error, plane//square//"&remove shape = 'cylinder' direction = 1 0 "// &
      & "axis = 'z' radius = 1 /"//line, "'axis' is no key of a cylinder with a "// &
      & "direction|a/b.nml:5")
  end subroutine test_refused

end module test_body_shapes
